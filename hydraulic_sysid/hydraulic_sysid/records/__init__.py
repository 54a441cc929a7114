"""Records: what was measured in one experiment, and how it is read from bags, CSV and MAT files."""

from hydraulic_sysid.records.errors import (
    BagError,
    ChannelError,
    ColumnMapError,
    FileError,
    RecordError,
    TimeError,
)

__all__ = ["BagError", "ChannelError", "ColumnMapError", "FileError", "RecordError", "TimeError"]
