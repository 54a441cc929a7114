"""Records: what was measured in one experiment, and how it is read from bags and tables, and written."""

from hydraulic_sysid.data.errors import BagError, ChannelError, ColumnMapError, FileError, RecordError, TimeError
from hydraulic_sysid.data.records.channels import CHANNELS
from hydraulic_sysid.data.records.column_map import ColumnMap, load_column_map, parse_column_map, shipped_maps
from hydraulic_sysid.data.records.reading import read_all, read_records
from hydraulic_sysid.data.records.record import Record
from hydraulic_sysid.data.records.writing import save, to_bag

__all__ = [
    "CHANNELS",
    "BagError",
    "ChannelError",
    "ColumnMap",
    "ColumnMapError",
    "FileError",
    "Record",
    "RecordError",
    "TimeError",
    "load_column_map",
    "parse_column_map",
    "read_all",
    "read_records",
    "save",
    "shipped_maps",
    "to_bag",
]
