"""Ground floor of the bench: the topic contract and the node base that serves it."""
