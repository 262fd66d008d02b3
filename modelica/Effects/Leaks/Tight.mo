within Effects.Leaks;
model Tight "Null version: nothing flows"
  extends Interfaces.Flow;
equation
  q = 0.0;
end Tight;
