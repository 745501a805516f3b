"""The wire boundary: MAVLink fields to typed records within physical bounds, and back.

Code behind it never looks at a field of the dialect. One reader parses each message into a record
within physical bounds, or rejects it with a named reason; outgoing values always fit their fields.
"""
