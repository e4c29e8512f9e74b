"""The robot in the browser or in MuJoCo's window: `poise view`."""
