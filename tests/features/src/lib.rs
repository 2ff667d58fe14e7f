//! Nothing: this package exists for the features of its dependencies. `generate.py` beside it says why.
