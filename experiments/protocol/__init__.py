"""How a model is trained, timed, stopped and tested: all that decides a number of a run."""
