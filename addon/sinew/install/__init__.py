"""Changes the file, in the main thread: binds, unbinds, and applies the mends that plans need."""
