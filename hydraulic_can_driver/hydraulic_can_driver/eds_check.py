"""Whether the objects that a bus file uses are those of the devices' EDS files: slips are found at a desk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from hydraulic_can_driver.bus import Address, Bus, Node
from hydraulic_can_driver.errors import BusFileError

FOLDER = Path(__file__).parent / "eds"

_TYPES = {
    "u8": (datatypes.UNSIGNED8, datatypes.BOOLEAN),
    "u16": (datatypes.UNSIGNED16,),
    "u32": (datatypes.UNSIGNED32,),
    "i8": (datatypes.INTEGER8,),
    "i16": (datatypes.INTEGER16,),
    "i32": (datatypes.INTEGER32,),
    "f32": (datatypes.REAL32,),
}
_NAMES = {number: name for name, numbers in _TYPES.items() for number in numbers}


def eds_file(bus: Bus, node: Node) -> Path:
    """The EDS file of a node: beside the bus file, or one that comes with the package.

    :raises BusFileError: there is none of that name.
    """
    for folder in (bus.path.parent, FOLDER):
        if node.eds and (folder / node.eds).is_file():
            return folder / node.eds
    raise BusFileError(f"{bus.path}: {node.name}: no EDS file {node.eds!r}, neither beside it nor in {FOLDER}")


def check_against_eds(bus: Bus) -> None:
    """Compare every object of every node that names an EDS file.

    :raises BusFileError: no such file, no such object, another type, or an object that cannot be mapped.
    """
    for node in bus.nodes.values():
        if not node.eds:
            continue
        path = eds_file(bus, node)
        try:
            dictionary = canopen.import_od(str(path), node.id)
        except Exception as error:  # the parser of EDS files raises whatever its pieces raise
            raise BusFileError(f"{path}: cannot be read as an EDS file: {error or type(error).__name__}") from None
        for address, mapped in _objects(node):
            found = _variable(dictionary, address)
            where = f"{bus.path}: {node.name}: {address}"
            if found is None:
                raise BusFileError(f"{where} is no object of {path.name}")
            if found.data_type not in _TYPES[address.type]:
                kind = _NAMES.get(found.data_type or 0, f"data type 0x{found.data_type or 0:02X}")
                raise BusFileError(f"{where} is {address.type}; in {path.name} it is {kind}")
            if mapped and not found.pdo_mappable:
                raise BusFileError(f"{where} cannot be mapped, says {path.name}")


def _objects(node: Node) -> Iterator[tuple[Address, bool]]:
    for pdo in (*node.receive, *node.transmit):
        for signal in pdo.signals:
            yield signal.address, True
    for address in (*(row.address for row in node.boot), *(row.address for row in node.inspect)):
        yield address, False


def _variable(dictionary: canopen.ObjectDictionary, address: Address) -> ODVariable | None:
    entry = dictionary.get(address.index)
    if isinstance(entry, ODRecord | ODArray):
        return entry.get(address.sub)
    return entry if isinstance(entry, ODVariable) and address.sub == 0 else None
