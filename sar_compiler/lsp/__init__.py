"""The language server: what editors ask about tree files while they are typed."""
