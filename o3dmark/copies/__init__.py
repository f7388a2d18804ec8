"""Copies: who was given which file, and whose a file is that turned up.

chain           the rows of a ledger   -> its head; the first row that does not fit
storage         a path                 -> an SQLite file that a kill or a loss of power leaves whole
ledger          entries                -> copies, entered together or not at all
verification    a ledger, a folder     -> what does not agree
buyers          a CSV file             -> the names of those who get a copy
issuing         an asset, names, a key -> marked files, each entered before it appears
archives        files, folders, archives -> what to look at
tracing         a suspect, copies, keys -> whose it is, and how probable it is that somebody innocent is named
words           a trace                -> a sentence

The public names stand in ``__init__.pyi``; each is imported when it is first used: a ledger is read without a mesh.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
