"""Echo models: from contacts to strengths."""
