"""Synthetic participants: ratings whose analysis gives wanted figures. Never a replication, always marked."""
