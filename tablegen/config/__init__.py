"""The two TOML files as frozen structs with units in their names; every fault at its file, line and key."""
