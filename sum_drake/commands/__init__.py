"""The commands of `sum-drake`: a module each says what a command takes and calls what does the work."""
