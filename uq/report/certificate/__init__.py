"""The certificate of an identified tensor: its front, its tables, its checks, and the result that holds them."""
