"""What users write after an option: text in, numbers and names of models out, or one line that says what is wrong.

Knows of no command.
"""
