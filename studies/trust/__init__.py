"""Whether DeepMuon can be trusted: campaigns of faults, damaged files and repetitions."""
