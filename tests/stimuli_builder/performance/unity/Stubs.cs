// As much of Unity's interface as the snippet in docs/explanation/blink-engine.md uses, and a Main that plays it.
using System;
using System.Globalization;
using System.Linq;
using System.Text.RegularExpressions;

namespace UnityEngine {
    public class Object { public string name = "face"; }
    public class TextAsset : Object { public string text; }
    public class Mesh {
        public string[] names = { "jawOpen", "eyeBlinkLeft", "eyeBlinkRight" };
        public int GetBlendShapeIndex(string name) { return Array.IndexOf(names, name); }
    }
    public class SkinnedMeshRenderer : Object {
        public Mesh sharedMesh = new Mesh();
        public float[] weights = new float[3];
        public void SetBlendShapeWeight(int index, float value) { weights[index] = value; }
    }
    public class MonoBehaviour : Object {
        public static SkinnedMeshRenderer shown = new SkinnedMeshRenderer();
        public bool enabled = true;
        public T GetComponent<T>() where T : class { return shown as T; }
    }
    public static class Time { public static float time; }
    public static class Debug { public static void LogError(object said) { Console.Error.WriteLine(said); } }
    public static class Mathf {
        public static int FloorToInt(float value) { return (int)Math.Floor(value); }
        public static float Lerp(float a, float b, float t) { return a + (b - a) * Math.Min(1, Math.Max(0, t)); }
    }
    public static class JsonUtility {
        // Unity's fills public fields of the same name, and leaves out what has no field.
        public static T FromJson<T>(string json) where T : new() {
            object made = new T();
            foreach (var field in typeof(T).GetFields()) {
                var found = Regex.Match(json, "\"" + field.Name + "\":\\s*(\\[[^\\]]*\\]|[^,}]*)");
                if (!found.Success) continue;
                var numbers = found.Groups[1].Value.Trim('[', ']').Split(',')
                    .Select(one => float.Parse(one, CultureInfo.InvariantCulture)).ToArray();
                field.SetValue(made, field.FieldType.IsArray ? (object)numbers : numbers[0]);
            }
            return (T)made;
        }
    }
}

public static class Player {
    static void Main(string[] arguments) {
        var blinks = new PalpebraBlinks { curve = new UnityEngine.TextAsset { text = System.IO.File.ReadAllText(arguments[0]) } };
        Call(blinks, "Start");
        foreach (var time in arguments.Skip(1)) {
            UnityEngine.Time.time = float.Parse(time, CultureInfo.InvariantCulture);
            Call(blinks, "LateUpdate");
            Console.WriteLine(string.Join(" ", UnityEngine.MonoBehaviour.shown.weights.Skip(1)
                .Select(one => one.ToString("R", CultureInfo.InvariantCulture))));
        }
    }

    static void Call(object on, string name) {
        on.GetType().GetMethod(name, System.Reflection.BindingFlags.Instance | System.Reflection.BindingFlags.NonPublic).Invoke(on, null);
    }
}
