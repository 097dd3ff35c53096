"""FMI: laws of this library written out as FMUs, and controllers in FMUs as laws."""
