"""A policy for other programs: ONNX, safetensors, Stable-Baselines3 alone, and its model card."""
