"""The two TOML files as frozen structs with units in their names; every fault with its file, line and key."""
