"""The space of flights as the test: flights drawn from a distribution, flown and scored."""
