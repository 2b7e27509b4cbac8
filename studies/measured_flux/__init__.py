"""The flux `measured`: what BESS-TeV and L3+C measured in, its fitted parameters, scores, pictures and rates out."""
