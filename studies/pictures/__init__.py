"""The pictures of the docs that are made by hand: models, samples and the packages' code in, pictures out."""
