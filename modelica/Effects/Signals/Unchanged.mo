within Effects.Signals;
model Unchanged "Null version: the nominal value acts"
  extends Interfaces.Signal;
equation
  y = u;
end Unchanged;
