"""Words of motion checks in Arabic.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("ما الرقم الذي رأيته؟", DIGITS),
    direction=Asked("في أي اتجاه تحركت النقاط؟", ("إلى اليسار", "إلى اليمين", "إلى الأعلى", "إلى الأسفل")),
    shape=Asked("ما الشكل الذي رأيته؟", ("دائرة", "مربع", "مثلث", "صليب")),
    first_blink=Asked("أي رمشة جاءت أولًا؟", ("الكاملة (انغلقت العينان)", "النصفية")),
    first_eye=Asked("أي عين أُغلقت أولًا، كما رأيتها أنت؟", ("التي على اليسار", "التي على اليمين")),
)
