within TrainRig.Slots;
model FreeAxles "Null version: nothing drags"
  extends PartialDrag;
equation
  tau = zeros(n);
end FreeAxles;
