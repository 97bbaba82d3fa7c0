"""The pictures of a report: arrays in, figures out, nothing saved.

Colours are safe for colour-blind eyes (after Okabe and Ito), and what a colour says is also said by a
label, a line style, a width or a number. Whoever calls holds `style.style` around drawing and saving.
"""
