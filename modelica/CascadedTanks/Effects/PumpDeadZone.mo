within CascadedTanks.Effects;
model PumpDeadZone "a pump that needs some voltage before it delivers"
  extends Common.Signals.DeadZone(zone(unit="V", max=3.0));
  annotation (
    __Workbench(effect(
      size="zone", matters=0.05,
      slots={"drive"},
      separation="steady flow of the pump into a bucket at several voltages")),
    Documentation(info="<html>
<p>Dry friction of motor and pump, and the head that it works against.</p>
</html>"));
end PumpDeadZone;
