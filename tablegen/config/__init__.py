"""Two TOML files in, frozen dataclass-like structs in SI-named units out; every fault at its file, line and key."""
