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
"""

from o3dmark.copies.archives import suspects
from o3dmark.copies.buyers import read_buyers
from o3dmark.copies.chain import EMPTY, Copy, Entry
from o3dmark.copies.issuing import Progress, issue
from o3dmark.copies.ledger import Ledger
from o3dmark.copies.tracing import Named, Trace, Tracer
from o3dmark.copies.verification import Verification, verify

__all__ = [
    "EMPTY",
    "Copy",
    "Entry",
    "Ledger",
    "Named",
    "Progress",
    "Trace",
    "Tracer",
    "Verification",
    "issue",
    "read_buyers",
    "suspects",
    "verify",
]
