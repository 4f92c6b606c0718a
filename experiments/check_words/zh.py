"""Words of motion checks in Chinese.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("您看到了哪个数字？", DIGITS),
    direction=Asked("圆点向哪个方向移动？", ("向左", "向右", "向上", "向下")),
    shape=Asked("您看到了哪种形状？", ("圆形", "正方形", "三角形", "十字形")),
    first_blink=Asked("哪一次眨眼在前？", ("完整的（眼睛闭上了）", "半闭的")),
    first_eye=Asked("从您的角度看，哪只眼睛先闭上？", ("左边的", "右边的")),
)
