"""In and out of Poise: checks of robots and policies, exports, the standalone controller."""
