"""The experiments: each measures one part of the project and leaves figures, tables and a page."""
