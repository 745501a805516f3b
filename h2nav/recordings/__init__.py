"""Flight recordings of every kind, as events of the service and as what else they say."""
