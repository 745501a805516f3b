"""Fuzzing: attackers, the rules that hold whatever they do, and the inputs that broke one."""
