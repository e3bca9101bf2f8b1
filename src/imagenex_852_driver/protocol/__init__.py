"""The protocol of the Imagenex 852: bytes to frozen dataclasses and back, without any input or output."""
