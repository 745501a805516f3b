"""How good the estimates are: filters, observer and odometry against truth; commands show it."""
