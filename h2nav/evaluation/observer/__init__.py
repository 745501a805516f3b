"""The twist observer in simulated trials: convergence, noise, a real camera."""
