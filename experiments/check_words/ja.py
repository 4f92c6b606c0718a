"""Words of motion checks in Japanese.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("どの数字が見えましたか？", DIGITS),
    direction=Asked("点はどの方向に動きましたか？", ("左", "右", "上", "下")),
    shape=Asked("どの形が見えましたか？", ("円", "四角形", "三角形", "十字")),
    first_blink=Asked("どちらのまばたきが先でしたか？", ("完全なまばたき（目が閉じた）", "半分のまばたき")),
    first_eye=Asked("あなたから見て、どちらの目が先に閉じましたか？", ("左の目", "右の目")),
)
