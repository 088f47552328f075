"""What programs that write trees can do with the project, and what a person approves of it."""
