"""The environments' base: observation, reward, falls, and the environment of joint torques."""
