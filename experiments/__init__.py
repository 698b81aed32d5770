"""Experiments: compose a scene and a model, time the run, write the record, draw the results."""
