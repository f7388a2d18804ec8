"""Issuing: a marked copy of an asset for each name, entered in the ledger before anybody can have it.

    marked and written into a hidden folder  ->  entered in the ledger  ->  the folder gets its name

Killed between any two of these, the next run goes on from there: a copy that was entered is put in its place, what was
not is thrown away and made again. No copy is ever in its place without its row.
"""

import os
import shutil
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from o3dmark.campaign.ledger import locked
from o3dmark.coding.identities import codeword
from o3dmark.coding.keys import Key
from o3dmark.copies.buyers import folder_of
from o3dmark.copies.chain import Copy, Entry
from o3dmark.copies.ledger import Ledger
from o3dmark.copies.verification import digest_of
from o3dmark.errors import BackendError, LedgerError, MeshError
from o3dmark.files import Asset, Source, destination, open_asset
from o3dmark.marking import Edition, Marked
from o3dmark.mesh import geometry
from o3dmark.profiles import DEFAULT_PROFILE, PROFILES
from o3dmark.watermark import Watermark

_LOCK = ".o3dmark.lock"


@dataclass(frozen=True)
class Order:
    """What copies are made of: an asset as it was when it was looked at, a profile, a number of bits, the asset's key.

    ``folder`` is where the copies go.
    """

    path: str
    asset: str
    profile: str
    n_bits: int
    key: Key
    folder: str

    @property
    def watermark(self) -> Watermark:
        return copies_watermark(self.profile, self.n_bits)

    def draft(self, name: str) -> Path:
        """The hidden folder that the copy of that name is written into."""
        return Path(self.folder, f".{folder_of(name)}.part")

    def place(self, name: str) -> Path:
        """The folder that the copy of that name gets."""
        return Path(self.folder, folder_of(name))


@dataclass(frozen=True)
class Progress:
    """``done`` of ``total`` copies are made; the last one just now (none at the start).

    ``elsewhere``: names that the ledger has, but whose files are no longer where they were written.
    """

    done: int
    total: int
    copy: Copy | None = None
    elsewhere: tuple[str, ...] = ()


def issue(
    path: str | Path,
    names: Iterable[str],
    key: Key,
    ledger: Ledger,
    out: str | Path,
    *,
    profile: str | None = None,
    n_bits: int | None = None,
    executor: Executor | None = None,
    in_flight: int = 1,
) -> Iterator[Progress]:
    """Make the copies of the asset at ``path`` that the ledger lacks: first where it stands, then an event for each.

    They go to out/<name of the asset>/<name of the copy>/, each in the asset's own format under its own name.
    ``profile`` None: that of the copies that there are of this asset, or else the default. ``executor``: where they are
    made; none: here. Errors: MeshError for an asset, or for a copy, that cannot be marked;
    LedgerError, also where the ledger knows another asset under this file's name; BackendError when a worker dies or
    another process writes there. What was entered before an error stays.
    """
    asset = open_asset(path)
    wanted = list(names)
    known = ledger.copies()
    order = _order(asset, key, Path(out), known, profile, n_bits)
    _check_unchanged(order, known)
    folder = Path(order.folder)
    if folder.exists() and not folder.is_dir():
        raise LedgerError(f"the copies go to a folder {str(folder)!r}, and a file of that name is there: another --out")
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder, _LOCK):
        entered = {copy.name: copy for copy in known if copy.asset == order.asset}
        lost = {name for name, copy in entered.items() if not _put_in_place(order, copy)}
        elsewhere = tuple(name for name in wanted if name in lost)
        missing = [name for name in wanted if name not in entered]
        for name in missing:
            shutil.rmtree(order.draft(name), ignore_errors=True)
        taken = [order.place(name) for name in missing if os.path.lexists(order.place(name))]
        if taken:
            raise LedgerError(
                f"{str(taken[0])!r} is there, but not in {ledger.path.name}: move it, or choose another --out"
            )
        done = len(wanted) - len(missing)
        yield Progress(done, len(wanted), elsewhere=elsewhere)
        made = (
            (written(order, name) for name in missing)
            if executor is None
            else _spread(order, missing, executor, in_flight)
        )
        for entry in made:
            (copy,) = ledger.add([entry])
            os.replace(order.draft(entry.name), order.place(entry.name))
            done += 1
            yield Progress(done, len(wanted), copy, elsewhere)


def asset_digest(asset: Asset) -> str:
    """What tells an asset from others: SHA-256 of its file; with files beside it that hold positions, of all digests.

    That is, SHA-256 of their 64 hexadecimal digits one after the other, the file's own first.
    """
    digests = [sha256(asset.source.read()).hexdigest()]
    digests += [sha256(asset.source.beside(name)).hexdigest() for name in asset.changing]
    return digests[0] if len(digests) == 1 else sha256("".join(digests).encode()).hexdigest()


def asset_key(key: Key, asset: str) -> Key:
    """The key that the copies of an asset (64 hexadecimal digits) are made and found with.

    It follows from the owner's; whoever learns it learns nothing about that, nor about another asset's.
    """
    return key.derived(f"asset/{asset}")


def copies_watermark(profile: str, n_bits: int | None = None) -> Watermark:
    """The watermark of copies: a profile, with another number of bits where one is given. Errors: SpecError."""
    return PROFILES[profile] if n_bits is None else replace(PROFILES[profile], n_bits=n_bits)


def written(order: Order, name: str) -> Entry:
    """Make a copy and write it into its draft; what is to be entered of it. Errors: MeshError as of `issue`."""
    edition = _edition(order)
    asset, draft = edition.asset, order.draft(name)
    draft.mkdir()
    try:
        target = destination(asset, draft / asset.name)
        marked = edition.copy(codeword(order.key, name, order.n_bits), names=target.names)
        if not marked.verified:
            raise MeshError(f"the copy {name!r} of {asset.name} cannot be read back: {marked.left[0].why}")
        target.write(marked.files)
        files = sorted((file for file in draft.rglob("*") if file.is_file()), key=lambda f: (f.name != asset.name, f))
        for file in files:
            _sync(file)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    paths = [Path(asset.name, folder_of(name), file.relative_to(draft)).as_posix() for file in files]
    digests = [digest_of(file) for file in files]
    pairs = tuple(zip(paths, digests, strict=True))
    key = order.key.fingerprint
    return Entry(order.asset, asset.name, name, key, order.profile, order.n_bits, _distortion(marked), pairs)


@lru_cache(maxsize=1)
def _edition(order: Order) -> Edition:
    asset = open_asset(Source(Path(order.path)))
    if asset_digest(asset) != order.asset:
        raise MeshError(f"{asset.name} was changed while its copies were made; begin again with the one that is right")
    return Edition(asset, order.watermark, order.key)


def _order(asset: Asset, key: Key, out: Path, known: Iterable[Copy], profile: str | None, n_bits: int | None) -> Order:
    digest = asset_digest(asset)
    if profile is None:
        mine = [(copy.profile, copy.n_bits) for copy in known if copy.asset == digest]
        profile, bits = mine[0] if mine else (DEFAULT_PROFILE, None)
        n_bits = n_bits or bits
    mark = copies_watermark(profile, n_bits)
    return Order(str(asset.path), digest, profile, mark.n_bits, asset_key(key, digest), str(out / asset.name))


def _check_unchanged(order: Order, known: Iterable[Copy]) -> None:
    source = Path(order.path).name
    others = {copy.asset for copy in known if copy.source == source} - {order.asset}
    mine = {(copy.profile, copy.n_bits) for copy in known if copy.asset == order.asset}
    if any(copy.asset == order.asset and copy.key != order.key.fingerprint for copy in known):
        raise LedgerError(f"the copies of {source} that the ledger has were made with another key")
    if others and not mine:
        raise LedgerError(
            f"the ledger has copies of another {source} (SHA-256 {min(others)[:12]}...): it has changed since. Bring"
            " the old file back, or give the new one another name"
        )
    if mine and mine != {(order.profile, order.n_bits)}:
        profile, n_bits = min(mine)
        raise LedgerError(f"the copies of {source} were made with {profile} and {n_bits} bits: go on with these")


def _put_in_place(order: Order, copy: Copy) -> bool:
    """Give a copy that was entered its place, if a kill came between; False where it is in neither."""
    place, draft = order.place(copy.name), order.draft(copy.name)
    if place.is_dir():
        return True
    files = [(draft / Path(path).relative_to(*Path(path).parts[:2]), digest) for path, digest in copy.files]
    if not all(file.is_file() and digest_of(file) == digest for file, digest in files):
        return False
    os.replace(draft, place)
    return True


def _spread(order: Order, names: Iterable[str], executor: Executor, in_flight: int) -> Iterator[Entry]:
    """Entries in the order in which they are ready."""
    waiting, running = deque(names), dict[Future[Entry], str]()
    try:
        while waiting or running:
            while waiting and len(running) < in_flight:
                name = waiting.popleft()
                running[executor.submit(written, order, name)] = name
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.pop(future)
                yield future.result()
    except BrokenExecutor as error:
        raise BackendError(f"a worker died ({error}). What was entered is kept: run the same command again") from None
    finally:
        for future in running:
            future.cancel()


def _sync(path: Path) -> None:
    """Have a file on the disk before the ledger says that it is there."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _distortion(marked: Marked) -> float:
    """MRMS to first order, over the diagonal, of the part where it is largest."""
    parts = [(marked.asset.parts[number], after) for number, after in marked.moved.items()]
    return max(geometry.motion_mrms(part.vertices, after, part.triangles) for part, after in parts)
