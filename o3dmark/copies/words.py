"""What a trace says, in words for people who do not know what a p-value is."""

from o3dmark.copies.tracing import Trace

_NAMES = {3: "thousand", 6: "million", 9: "billion", 12: "trillion"}
_NAMED_UP_TO = 15  # powers of ten that have a name here; beyond, 10^18 says more


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
    return (
        f"Found: the copy of {trace.best.copy.name}. The chance that this is a mistake is {one_in(trace.best.log10_p)}."
    )


def one_in(log10_p: float) -> str:
    """A probability (its log10) as "1 in 24 million", rounded so that it never sounds rarer than it is."""
    power = -log10_p
    if power >= _NAMED_UP_TO:
        return f"1 in 10^{int(power)}"
    steps = int(power // 3) * 3
    count = int(10.0 ** (power - steps) + 1e-9)
    return f"1 in {count} {_NAMES[steps]}" if steps else f"1 in {max(count, 1)}"
