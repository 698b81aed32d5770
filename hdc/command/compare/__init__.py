"""``hdc compare``: which encoder and read-out suit frames of one's own.

:mod:`.candidates` are forms of the library and models of grey values, :mod:`.judge` cross-validates
them and tests the gain of one, :mod:`.command` prints a row a model as it is done.
"""
