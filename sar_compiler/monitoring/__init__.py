"""What others see of a tree while it is ticked: its nodes by number, what becomes of them, Groot2's protocol."""
