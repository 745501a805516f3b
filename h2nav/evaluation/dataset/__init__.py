"""Our attitude filters and other people's on recorded trials with truth."""
