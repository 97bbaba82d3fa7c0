"""Proofs that a closed loop reaches its goal and keeps its speed limit, from every start of a box."""
