"""The wire boundary: MAVLink fields to typed records within physical bounds, and back.

Nothing behind it looks at a field of the dialect. A message is read once, by one reader, into a
record whose values make sense, or it is refused by name; what is written always fits its fields.
"""
