# SPDX-License-Identifier: BSD-3-Clause
"""Structures and trajectories, as ASE and MDAnalysis read them, and what each needs help with."""

from __future__ import annotations

import io
import itertools
import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, missing_extra, one_line
from halfshell._cli.text_files import kind_of_file, open_bytes
from halfshell._convert.objects import SYMBOLS, placeholder
from halfshell._convert.points import Points

Frames = int | slice | None

_OF_CELL = ((0, 9), (9, 9), (18, 9), (27, 7), (34, 7), (41, 7))  # numbers of a line CRYST1
_CELL_OF_MMCIF = (
    "length_a", "length_b", "length_c", "angle_alpha", "angle_beta", "angle_gamma"
)  # fmt: skip
_CIF_WORD = re.compile(r"""'(.*?)'(?=\s)|"(.*?)"(?=\s)|(\S+)""")
_LAMMPS_STYLES = (None, "molecular", "charge", "full", "atomic")  # None: what the file says


class UnknownFormat(Exception):
    """A reader does not know the format of a file."""


@dataclass(frozen=True)
class Scene:
    """Points with their box, and where they come from."""

    points: NDArray[Any]  # (n, d), finite, n >= 1
    box: NDArray[Any] | None = None  # edge lengths (d,), or edge vectors as rows (d, d)
    periodic: tuple[bool, ...] = (False,) * 3
    source: str = ""  # the file, or what ships with the package; for messages
    species: NDArray[np.str_] | None = None  # chemical symbols, where the file has them
    unit: str = ""  # "angstrom" where it is known
    remarks: tuple[str, ...] = ()  # what the reader of the file warned of
    reader: str = ""  # what read the file, and what of it; empty for what ships with the package
    no_box: str = ""  # why the box that the file has is none
    frame: str = ""  # which of several frames this is, for messages

    @property
    def where(self) -> str:
        """The file, and the frame of several."""
        return f"{self.source}: {self.frame}" if self.frame else self.source

    @cached_property
    def known(self) -> Points:
        """What a search takes: points, box, periodicity, and elements as types."""
        periodic = None if self.box is None else self.periodic
        return Points(self.points, box=self.box, periodic=periodic, types=self.species)

    @property
    def box_rows(self) -> NDArray[np.float64] | None:
        """The edge vectors as rows, shape (d, d), or None."""
        if self.box is None:
            return None
        box = np.asarray(self.box, dtype=np.float64)
        return np.diag(box) if box.ndim == 1 else box


# ---- ASE ---------------------------------------------------------------------------------------

def by_ase(file: str, file_format: str | None, frames: Frames) -> Iterator[Scene]:
    """Frames as ASE reads them: one, by default the last, unless `frames` is a range.

    Those of a range are read one by one, where the reader of the format does so.

    LAMMPS data, mmCIF and VASP 4 are told from what the file holds, because ASE does not. It may
    raise anything for a broken file.
    """
    try:
        import ase
        import ase.io
        from ase.io.formats import UnknownFileTypeError, filetype
    except ImportError:
        raise missing_extra("reading this file", "ase") from None
    own = None if file_format else _ase_needs_help(file)
    with _warnings() as remarks:
        try:
            name = file_format or (own[0] if own else filetype(file))

            def read(index: int | slice) -> Any:
                if own:
                    return own[1]()[index]
                some = ase.io.iread if isinstance(index, slice) else ase.io.read
                return some(file, index, format=name, do_not_split_by_at_sign=True)

            found: Any
            if isinstance(frames, slice):
                found = read(frames)
            else:
                number = -1 if frames is None else frames
                found = [read(number)]
                if not len(found[0]):  # such as that between ENDMDL and END of a PDB file
                    found = [[atoms for atoms in read(slice(None)) if len(atoms)][number]]
        except UnknownFileTypeError:
            raise UnknownFormat from None
        except (IndexError, StopIteration) as error:
            what = f"has no frame {frames}" if isinstance(frames, int) else "holds no atoms"
            detail = f" ({one_line(error)})" if str(error) else ""
            raise InputError(what + detail) from None
    reader = f"ASE {ase.__version__}, {name}"
    names: Iterable[str] = [""]
    if isinstance(frames, slice):
        start, step = frames.start or 0, frames.step or 1
        names = (f"frame {number}" for number in itertools.count(start, step))
        if start < 0 or step < 0:
            where = "counted from the first that --index names"
            names = (f"frame {number}, {where}" for number in itertools.count())
    for frame, atoms in _each(found, names, remarks):
        if not len(atoms):
            if isinstance(frames, slice) and min(frames.start or 0, frames.stop or 0) < 0:
                raise InputError(f"{frame} holds no atoms: count frames from the first on")
            continue
        labels, residues = (atoms.arrays.get(part) for part in ("atomtypes", "residuenames"))
        species, how = _species(atoms.get_chemical_symbols(), labels, residues)
        is_lammps = "lammps" in name
        if is_lammps and np.array_equal(atoms.arrays.get("type", ()), atoms.numbers):
            species, how = None, ": types, not elements"
        box = atoms.cell.array if atoms.cell.rank > 0 else None
        no_box = placeholder(atoms.cell.array, residues is not None) if atoms.pbc.any() else ""
        yield Scene(
            atoms.positions, None if no_box else box, tuple((atoms.pbc & (not no_box)).tolist()),
            species=species, unit="" if is_lammps else "angstrom", remarks=tuple(remarks),
            reader=reader + how, no_box=no_box, frame=frame,
        )  # fmt: skip


def _ase_needs_help(file: str) -> tuple[str, Callable[[], list[Any]]] | None:
    """A format that ASE does not recognise, but may read, and how."""
    with open_bytes(file) as stream:
        head = stream.read(1 << 14)
    if b"_atom_site.Cartn_x" in head or re.match(rb"data_\w+\s+#\s+_entry\.id", head):
        return "mmcif", partial(_of_mmcif, file)
    if re.search(rb"^\s*\d+\s+atoms\b", head[:4000], re.M) and b"atom types" in head:
        return "lammps-data", partial(_of_lammps, file)
    cell = re.search(rb"^CRYST1(.{48})", head, re.M)
    if cell and any(not float(cell[1][k : k + width].strip() or 0) for k, width in _OF_CELL):
        return "proteindatabank", partial(_of_pdb_without_cell, file)
    lines = head.splitlines()[:8]
    counts = lines[5].split() if len(lines) == 8 else ()
    vectors = [len(line.split()) for line in lines[1:5]]
    if counts and all(map(bytes.isdigit, counts)) and vectors == [1, 3, 3, 3]:
        with suppress(ValueError):
            _ = [float(word) for line in lines[1:5] for word in line.split()]
            return "vasp 4", partial(_of_vasp4, file)
    return None


def _of_lammps(file: str) -> list[Any]:
    """LAMMPS data, by the style that it names or else by each that fits; no image is unwrapped."""
    import ase.io

    said = []
    for style in _LAMMPS_STYLES:
        try:
            return [ase.io.read(file, format="lammps-data", atom_style=style,
                                read_image_flags=False, do_not_split_by_at_sign=True)]  # fmt: skip
        except MemoryError:
            raise
        except Exception as error:
            said.append(f"{style or 'the style of the file'}: {one_line(error)}")
    raise InputError("no style of atoms fits: " + "; ".join(said))


def _of_mmcif(file: str) -> list[Any]:
    """The models of an mmCIF file, whose coordinates are Cartesian; ASE's parser takes minutes."""
    from ase import Atoms

    with open_bytes(file) as stream:
        lines = io.TextIOWrapper(stream, "utf-8").readlines()
    items = (line.split(maxsplit=1) for line in lines if line.startswith("_cell."))
    cell = {name.lower(): value.strip() for name, value in items}
    names = [(k, line) for k, line in enumerate(lines) if line.startswith("_atom_site.")]
    rows = []
    for line in itertools.takewhile(
        lambda line: line[:1] not in "#_\n" and line[:5] not in ("loop_", "data_"),
        lines[names[-1][0] + 1 :] if names else (),
    ):
        words = [quoted or double or word for quoted, double, word in _CIF_WORD.findall(line)]
        if len(words) != len(names):
            raise InputError(f"an atom has {len(words)} values, not {len(names)}")
        rows.append(words)
    sites = dict(zip((line.split()[0].lower() for _, line in names), zip(*rows, strict=True)))
    keys = [f"_atom_site.{key}" for key in ("type_symbol", "cartn_x", "cartn_y", "cartn_z")]
    if not all(sites.get(key) for key in keys):
        raise InputError("holds no atoms")
    symbols, *axes = (np.array(sites[key]) for key in keys)
    points = np.stack(axes, axis=1).astype(np.float64)
    species = ["H" if s == "D" else s.capitalize() for s in symbols.tolist()]
    species = [s if s in SYMBOLS else "X" for s in species]
    known = [cell.get(f"_cell.{part}", "?") for part in _CELL_OF_MMCIF]
    has_cell = all(re.fullmatch(r"[\d.]+", value) for value in known)
    models = np.array(sites.get("_atom_site.pdbx_pdb_model_num") or [""] * len(points))
    frames = []
    for model in dict.fromkeys(models.tolist()):
        part = models == model
        atoms = Atoms(np.array(species)[part], points[part], pbc=has_cell)
        if has_cell and all(map(float, known)):
            atoms.cell = [float(value) for value in known]
        atoms.arrays["residuenames"] = np.full(len(atoms), "?")  # as of a PDB file
        frames.append(atoms)
    return frames


def _of_pdb_without_cell(file: str) -> list[Any]:
    """The models of a PDB file whose lengths or angles are zero, which ASE does not take."""
    import ase.io

    with open_bytes(file) as stream:
        lines = [line for line in stream.read().decode("utf-8").splitlines(keepends=True)
                 if not line.startswith("CRYST1")]  # fmt: skip
    found = ase.io.read(io.StringIO("".join(lines)), index=slice(None), format="proteindatabank")
    for atoms in found:
        atoms.pbc = True  # with a cell of zeros: a box is said, and none
    return list(found)


def _of_vasp4(file: str) -> list[Any]:
    """A POSCAR without names of species, which are read where the first line has them."""
    from ase.io.vasp import read_vasp

    with open_bytes(file) as stream:
        lines = io.TextIOWrapper(stream, "utf-8").read().splitlines()
    words, n = lines[0].split(), len(lines[5].split())
    named = len(words) == n and set(words) <= set(SYMBOLS)
    lines.insert(5, " ".join(words if named else ["X"] * n))
    return [read_vasp(io.StringIO("\n".join(lines) + "\n"))]


# ---- MDAnalysis --------------------------------------------------------------------------------

# What it does not know by these names.
_NAMES_OF_MDANALYSIS = {
    "RST7": "INPCRD", "RST": "INPCRD", "LAMMPSTRJ": "LAMMPSDUMP", "DUMP": "LAMMPSDUMP",
    "LMP": "DATA", "PDBX": "MMCIF",
}  # fmt: skip


_NOT_OF_POINTS = re.compile(r"[Mm]ass|atom types|guess types|dt information|[Ee]lement")


def by_mdanalysis(
    file: str, file_format: str | None, frames: Frames, trajectory: str | None = None
) -> Iterator[Scene]:
    """Frames as MDAnalysis reads them, where it is installed; see `by_ase`.

    With `trajectory` they are in that file, and `file` is its topology.
    """
    try:
        import MDAnalysis
    except ImportError:
        if trajectory is not None:
            raise missing_extra("--trajectory", "MDAnalysis") from None
        raise UnknownFormat from None
    kind = (file_format or kind_of_file(file)[1:] or Path(file).name.split("_")[0]).upper()
    kind = _NAMES_OF_MDANALYSIS.get(kind, kind)
    parsers, readers = (getattr(MDAnalysis, part, {}) for part in ("_PARSERS", "_READERS"))
    if kind not in parsers and kind not in readers:
        raise UnknownFormat
    with _warnings() as remarks:
        if kind in parsers or trajectory is not None:  # a file that says which atoms there are
            files = [file] if trajectory is None else [file, trajectory]
            formats = {"topology_format": kind} if kind in parsers else {}
            if trajectory is None and kind in readers:
                formats["format"] = kind
            try:
                universe = MDAnalysis.Universe(*files, to_guess=("elements",), **formats)
            except (ValueError, TypeError, NotImplementedError):  # no names to guess by
                universe = MDAnalysis.Universe(*files, to_guess=(), **formats)
        else:
            try:
                universe = MDAnalysis.Universe.empty(readers[kind].parse_n_atoms(file))
            except NotImplementedError:
                raise InputError(
                    "holds coordinates alone, which are read with a topology: give that as FILE, "
                    "and this with --trajectory"
                ) from None
            universe.load_new(file, format=kind)
        try:
            steps = universe.trajectory
        except AttributeError:
            raise InputError(
                "holds a topology without coordinates: give these with --trajectory"
            ) from None
        numbers = range(len(steps))
        one = -1 if frames is None else frames
        try:
            chosen = numbers[one] if isinstance(one, slice) else [numbers[one]]
        except IndexError:
            raise InputError(f"has no frame {frames}") from None
        parts = (getattr(universe.atoms, one, None) for one in ("elements", "names", "resnames"))
        species, how = _species(*parts)
        reader = f"MDAnalysis {MDAnalysis.__version__}, {kind}{how}"
    names = (f"frame {k}" if isinstance(frames, slice) else "" for k in chosen)
    for frame, step in _each((steps[k] for k in chosen), names, remarks):
        told = tuple(remark for remark in remarks if not _NOT_OF_POINTS.search(remark))
        box = None if step.dimensions is None else step.triclinic_dimensions.astype(np.float64)
        no_box = "" if box is None else placeholder(box, False)
        box = None if no_box else box
        yield Scene(
            step.positions.copy(), box, (box is not None,) * 3, species=species, unit="angstrom",
            remarks=told, reader=reader, no_box=no_box, frame=frame,
        )  # fmt: skip


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """What a reader warns of, each once, once the block is left."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
        told = (" ".join(str(w.message).split()) for w in caught
                if issubclass(w.category, UserWarning))  # fmt: skip
        texts += dict.fromkeys(told)


def _each(
    found: Iterable[Any], names: Iterable[str], remarks: list[str]
) -> Iterator[tuple[str, Any]]:
    """Frames one by one with their names, read when they are wanted.

    What is warned of is put to the remarks. InputError names the frame at which reading fails.
    """
    iterator = iter(found)
    for count, frame in enumerate(itertools.chain(names, [""])):
        with _warnings() as more:
            try:
                one = next(iterator, None)
            except MemoryError:
                raise
            except Exception as error:
                if not count:
                    raise
                kind = type(error).__name__
                raise InputError(f"{frame}: {kind}: {one_line(error)}") from None
        remarks += [text for text in more if text not in remarks]
        if one is None:
            return
        yield frame, one


# ---- elements ----------------------------------------------------------------------------------

# Residues of proteins, nucleic acids and water, in which only these elements are.
_RESIDUES = frozenset("""
ALA ARG ASN ASP CYS GLN GLU GLY HIS ILE LEU LYS MET PHE PRO SER THR TRP TYR VAL ACE NME NMA NH2 MSE
HSD HSE HSP HID HIE HIP CYX CYM CYSH ASH GLH LYN LYSH HISA HISB HISH HIS1 HIS2 A C G T U DA DC DG
DT DU RA RC RG RU ADE CYT GUA THY URA HOH WAT SOL TIP TIP3 TIP4 TIP5 T3P SPC SPCE H2O DOD
""".split())
_LIGHT = frozenset(("H", "D", "C", "N", "O", "S", "P", "Se", "X", ""))
_IONS = {"SOD": "Na", "POT": "K", "CLA": "Cl", "CAL": "Ca", "CES": "Cs", "LIT": "Li"}  # of CHARMM
_HEAVY = frozenset("FE ZN MG MN CL BR NA CU CO NI SE SI AL LI".split())  # that ligands may have


def _species(symbols: Any, names: Any, residues: Any) -> tuple[NDArray[np.str_] | None, str]:
    """Elements, None if none is known, and words for where they are from if not the symbols."""
    if symbols is None:
        return None, ""
    species, how = np.array([str(symbol).capitalize() or "X" for symbol in symbols]), ""
    if names is not None and residues is not None:
        kinds = set(zip(species.tolist(), map(str, residues)))
        known = [s for s, residue in kinds if residue.strip().upper() in _RESIDUES]
        if not _LIGHT.issuperset(known):  # no amino acid, nucleotide or water has that element
            pairs = zip(map(str, names), map(str, residues), strict=True)
            species = np.array([_element(*pair) for pair in pairs])
            how = ": elements by names of atoms"
    return None if (species == "X").all() else species, how


@cache
def _element(name: str, residue: str) -> str:
    """The element by the name of an atom, as is usual in residues; ``X`` where none is meant."""
    letters = re.sub(r"[^A-Z]", "", name.upper())
    residue = residue.strip().upper()
    if residue not in _RESIDUES:
        if letters == re.sub(r"[^A-Z]", "", residue):  # an ion
            ion = _IONS.get(letters, letters.capitalize())
            return ion if ion in SYMBOLS else "X"
        if letters[:2] in _HEAVY:
            return letters[:2].capitalize()
    elif residue == "MSE" and letters == "SE":
        return "Se"
    first = "H" if letters[:1] == "D" and residue in _RESIDUES else letters[:1]
    return first if first in SYMBOLS and (first in _LIGHT or residue not in _RESIDUES) else "X"
