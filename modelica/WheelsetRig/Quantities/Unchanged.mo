within WheelsetRig.Quantities;
model Unchanged "Null version: the nominal value acts"
  extends PartialQuantity;
  extends Common.Signals.Unchanged;
end Unchanged;
