"""Node side of the contract: base class of plant nodes, parameters, mailboxes. No executables."""
