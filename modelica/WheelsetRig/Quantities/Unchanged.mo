within WheelsetRig.Quantities;
model Unchanged "Null version: the nominal value acts"
  extends PartialQuantity;
equation
  actual = nominal;
end Unchanged;
