"""Output for people and tools."""
