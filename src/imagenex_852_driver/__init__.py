"""Driver of the Imagenex 852 scanning sonar: wire protocol, serial line, log files and an emulated head."""
