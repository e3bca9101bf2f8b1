"""What messages hold, as arrays; a message is any object with the fields of its definition."""
