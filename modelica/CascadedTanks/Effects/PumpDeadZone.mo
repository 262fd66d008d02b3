within CascadedTanks.Effects;
model PumpDeadZone "a pump that needs some voltage before it delivers"
  extends Slots.PartialSignal;
  parameter Real zone(unit="V", min=0.0, max=3.0) = 0.0 "Voltage below which nothing flows";
equation
  y = Functions.above(u - zone) - Functions.above(-u - zone);
  annotation (
    __Workbench(effect(
      size="zone", step=0.02, matters=0.05,
      slots={"drive"},
      separation="steady flow of the pump into a bucket at several voltages")),
    Documentation(info="<html>
<p><code>y = max(0, u - zone)</code>, in either direction, with kinks that are rounded over 0.05 V: dry
friction of motor and pump, and the head that it works against.</p>
</html>"));
end PumpDeadZone;
