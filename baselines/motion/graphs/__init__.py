"""Which clip may follow which, where and at what cost, and the cheapest ways through them."""
