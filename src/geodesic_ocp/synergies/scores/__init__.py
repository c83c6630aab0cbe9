"""How well a predicted motion explains an observed one."""
