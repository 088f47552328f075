"""What others see of a tree while it is ticked: its nodes by number, their statuses, Groot2's protocol."""
