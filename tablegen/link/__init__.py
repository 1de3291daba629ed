"""The host's end of the serial link to a running instrument: ``docs/protocol.md`` in Python.

``Device`` is what control software uses; the layers below it are one file each, from bytes to uploads.
"""
