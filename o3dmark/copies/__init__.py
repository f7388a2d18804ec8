"""Copies: who was given which file, in a ledger whose head can be time-stamped elsewhere.

chain           the rows of a ledger   -> its head; the first row that does not fit
storage         a path                 -> an SQLite file that a kill or a loss of power leaves whole
ledger          entries                -> copies, entered together or not at all
verification    a ledger, a folder     -> what does not agree
"""

from o3dmark.copies.chain import EMPTY, Copy, Entry
from o3dmark.copies.ledger import Ledger
from o3dmark.copies.verification import Verification, verify

__all__ = ["EMPTY", "Copy", "Entry", "Ledger", "Verification", "verify"]
