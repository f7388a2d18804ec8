"""What a trace says, in words for people who do not know what a p-value is."""

from o3dmark.coding.words import mistaken, one_in
from o3dmark.copies.tracing import Trace


def sentence(trace: Trace) -> str:
    """The answer of a trace, and how probable it is that it is wrong."""
    if not trace.candidates:
        return "None of your copies: the ledger is empty."
    if trace.best is None or not trace.found:
        return "None of your copies."
    if trace.mixed:
        names = " and ".join(named.copy.name for named in trace.mixed)
        worst = one_in(max(named.log10_p for named in trace.mixed))
        found = f"Found: a mixture of copies, to which {names} gave theirs."
        return f"{found} For each, the chance that this is a mistake is {worst} at most."
    return f"Found: the copy of {trace.best.copy.name}. {mistaken(trace.best.log10_p)}"
